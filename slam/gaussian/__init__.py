"""Gaussian filters like the EKF that linearise otherwise: at first estimates, by sigma points."""
