"""`trackside campaign`: a whole experiment from a file, with nothing done twice, to one report.

Sessions are simulated or given; each is joined, estimated and scored by every run of the file.
"""
