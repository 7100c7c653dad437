"""The command ``levimass`` and its modes; none but the window needs Qt."""
