"""`trackside slam tune`: many runs of SLAM, each scored, to find the parameters that score best.

Here `slam` and `scoring`, which never import each other, are wired together.
"""
