"""Words and number formats for the screen, reports and files."""
