"""Estimate + truth -> score: the multi-error function of the thesis and its neighbours.

Knows nothing of algorithms: an estimate is a path, a map and their provenance, from wherever.
"""
