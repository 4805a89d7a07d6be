"""Two machines, one clock: the gyro and the wheels of the car against the car as it was filmed.

`fit_clock` gives offset and skew with their uncertainty, or says why the motion does not tell them;
`network_line` is what the machines told each other over the network, and `compared` says whether
the two agree. What the camera is late by is the difference of the two (`camera_delay`).
"""
