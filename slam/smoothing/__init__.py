"""The final pass: path and map of the whole recording at once (`slam.smoothing.smoother`)."""
