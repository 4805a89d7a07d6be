"""Where the two rings sit on the car: `base_link` is where the car does not slip sideways."""
