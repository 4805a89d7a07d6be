"""The session: recording it, importing it, reading it, exporting it.

The only room that knows the file formats: session folders, MCAP logs, ROS bags, TUM trajectories,
landmark tables. `rosbags` and `mcap` are imported when a log is opened, not before.
"""
