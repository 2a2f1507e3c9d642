"""A small operating system below a folder: /sys, /dev, /proc and /etc/group as Linux lays them out."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from handctl.tools.port_inventory import Machine


class System:
    """Builds the folder. Device files are empty; nothing in the tests can write to one unseen."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.denied: set[str] = set()
        self.user = "pat"
        self.ip = ""
        self.source = ""
        for folder in ("proc", "dev", "sys/class/tty", "sys/class/net", "sys/bus/usb/devices", "run/lock", "etc"):
            (root / folder).mkdir(parents=True)
        self.write("/etc/group", f"tty:x:99999:\ndialout:x:{os.getgid()}:lee\n")

    def write(self, path: str, text: str) -> Path:
        """A file with its folders."""
        place = self.root / path.lstrip("/")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
        return place

    def link(self, path: str, target: Path) -> None:
        """A relative symbolic link, as sysfs has them."""
        place = self.root / path.lstrip("/")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.symlink_to(os.path.relpath(target, place.parent))

    def usb(self, bus: str, vid: str, pid: str, serial: str = "", product: str = "") -> Path:
        """A USB device without a port."""
        home = f"/sys/devices/pci0/usb1/{bus}"
        for name, text in (("idVendor", vid), ("idProduct", pid), ("serial", serial), ("product", product)):
            if text:
                self.write(f"{home}/{name}", f"{text}\n")
        interface = self.root / f"{home.lstrip('/')}/{bus}:1.0"
        interface.mkdir()
        self.link(f"/sys/bus/usb/devices/{bus}", interface.parent)
        return interface

    def tty(
        self,
        name: str,
        *,
        usb: tuple[str, ...] = (),
        driver: str = "",
        bus: str = "1-1",
        by_id: str = "",
        latency: int = 0,
    ) -> None:
        """A serial port, with the USB device (VID, PID, serial, product) it belongs to."""
        interface = self.usb(bus, *usb) if usb else self.root / "sys/devices/platform/serial"
        device = interface / name
        (device / "tty" / name).mkdir(parents=True)
        self.link(f"/sys/class/tty/{name}", device / "tty" / name)
        (device / "tty" / name / "device").symlink_to("../..")
        if driver:
            self.write(f"/sys/bus/drivers/{driver}/bind", "")
            (device / "driver").symlink_to(os.path.relpath(self.root / f"sys/bus/drivers/{driver}", device))
        if latency:
            (device / "latency_timer").write_text(f"{latency}\n")
            self.link(f"/sys/bus/usb-serial/devices/{name}", device)
        self.write(f"/dev/{name}", "")
        if by_id:
            self.link(f"/dev/serial/by-id/{by_id}", self.root / "dev" / name)

    def can(self, name: str, state: str, driver: str = "") -> None:
        """A CAN interface."""
        self.write(f"/sys/class/net/{name}/type", "280\n")
        self.write(f"/sys/class/net/{name}/operstate", f"{state}\n")
        if driver:
            self.link(f"/sys/class/net/{name}/device/driver", self.write(f"/sys/bus/drivers/{driver}/bind", "").parent)

    def process(self, pid: int, name: str, opened: str = "") -> None:
        """A running program, perhaps with a port open."""
        self.write(f"/proc/{pid}/comm", f"{name}\n")
        (self.root / f"proc/{pid}/fd").mkdir()
        if opened:
            (self.root / f"proc/{pid}/fd/3").symlink_to(opened)

    def machine(self, **more: Any) -> Machine:
        """What handctl sees of it."""
        return Machine(
            **{
                "root": self.root,
                "linux": True,
                "user": lambda: self.user,
                "access": lambda path: f"/{path.relative_to(self.root)}" not in self.denied,
                "run_ip": lambda: self.ip,
                "source": lambda _address: self.source,
                "listing": list,
                **more,
            }
        )
