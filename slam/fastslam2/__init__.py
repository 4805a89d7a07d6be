"""FastSLAM 2.0: particles that look before they move (`slam.fastslam2.filter`)."""
