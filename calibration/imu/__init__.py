"""Bias, noise, scale and mounting of an inertial sensor."""
