"""What reaches a person or a pipe: tables, live views, text with no character that acts on a terminal."""
