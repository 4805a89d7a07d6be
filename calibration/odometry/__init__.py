"""What ties the motor controller's numbers to the car: counts to metres, servo to curvature."""
