"""The udev rules of a car: stable names under /dev/rc, the right group, no ModemManager, no sleep.

Vendor rules and ids: reference/protocols.md, part F.
"""

from __future__ import annotations

RULES = """\
# Names and permissions of the devices of a trackside car. Install as
#   trackside devices --udev-rules | sudo tee /etc/udev/rules.d/99-rc-car.rules
#   sudo udevadm control --reload && sudo udevadm trigger
# Two adapters of one kind (every CP2102 says serial 0001): tell them apart by ENV{ID_PATH}.

# RPLidar on its USB board (CP2102), VESC, Razor IMU M0
SUBSYSTEM=="tty", ATTRS{idVendor}=="10c4", ATTRS{idProduct}=="ea60", \
SYMLINK+="rc/lidar", GROUP="dialout", MODE="0660", ENV{ID_MM_DEVICE_IGNORE}="1"
SUBSYSTEM=="tty", ATTRS{idVendor}=="0483", ATTRS{idProduct}=="5740", \
SYMLINK+="rc/vesc", GROUP="dialout", MODE="0660", ENV{ID_MM_DEVICE_IGNORE}="1"
SUBSYSTEM=="tty", ATTRS{idVendor}=="1b4f", ATTRS{idProduct}=="9d0f", \
SYMLINK+="rc/imu", GROUP="dialout", MODE="0660", ENV{ID_MM_DEVICE_IGNORE}="1"

# FTDI adapters hold bytes back for 16 ms unless they are told not to
ACTION=="add", SUBSYSTEM=="usb-serial", DRIVERS=="ftdi_sio", ATTR{latency_timer}="1"

# ZED, and any camera by the name of its port
SUBSYSTEM=="video4linux", ATTRS{idVendor}=="2b03", ATTR{index}=="0", \
SYMLINK+="rc/zed", GROUP="video", MODE="0660"

# None of them may be put to sleep
ACTION=="add", SUBSYSTEM=="usb", ATTR{idVendor}=="10c4", ATTR{power/control}="on"
ACTION=="add", SUBSYSTEM=="usb", ATTR{idVendor}=="0483", ATTR{power/control}="on"
ACTION=="add", SUBSYSTEM=="usb", ATTR{idVendor}=="1b4f", ATTR{power/control}="on"
ACTION=="add", SUBSYSTEM=="usb", ATTR{idVendor}=="2b03", ATTR{power/control}="on"
"""
