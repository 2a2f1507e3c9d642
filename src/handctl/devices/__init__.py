"""One folder per device family. No family imports another; nothing imports a family except by name in `families.py`."""
