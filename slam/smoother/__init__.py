"""Smoothing while driving: the whole past is solved anew (`slam.smoother.filter`)."""
