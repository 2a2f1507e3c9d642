"""The wrist module, over serial and CAN."""
