"""Output for people and pipes: tables, live views, CSV, JSON, and text without terminal control characters."""
