"""Laws that no catalogue holds: curves, the forms they have, and how they are told."""
