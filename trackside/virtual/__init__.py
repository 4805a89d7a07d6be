"""The virtual track as commands: what a track day brings, from one seed and without hardware."""
