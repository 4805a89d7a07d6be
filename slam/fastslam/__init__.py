"""FastSLAM: a cloud of particles, each a path with a map of its own (`slam.fastslam.filter`)."""
