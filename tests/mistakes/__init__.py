"""Seeded mistakes: what somebody could write wrongly, and the tests that must see it."""
