"""``python -m app`` is ``levimass``."""

from app.command_line.cli import main

raise SystemExit(main())
