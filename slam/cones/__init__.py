"""Cones in lidar revolutions: where they stand and how sure that is (`slam.cones.detection`)."""
