"""The desktop window: presenters between the session and the panels, panels, plots."""
