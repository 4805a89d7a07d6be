"""The commands of the overhead camera; what they call stands one floor up."""
