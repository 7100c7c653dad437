"""What the program's names and numbers are called in words, on the screen and in files."""
