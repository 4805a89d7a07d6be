"""Where the lidar sits on the car, from cones of known place seen along a known path."""
