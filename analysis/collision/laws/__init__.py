"""Laws that no catalogue holds: those that a person writes down as a formula."""
