"""Recording: the rig, all its devices at once into one session, and whether it is any good.

Devices are read in a thread each (`drivers.DeviceReader`); what they bring goes through one inbox
to one scribe, which alone writes. What was recorded is judged by one function, live and later.
"""
