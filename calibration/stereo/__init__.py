"""The two eyes of a stereo camera: from pictures of a board, or from the factory's file."""
