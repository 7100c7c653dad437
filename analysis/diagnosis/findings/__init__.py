"""What a diagnosis found, as data, in words and in files, and the criteria that decide."""
