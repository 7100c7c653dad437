"""What an attacker or a bad day sends, by kind; ``python -m tests.attack`` runs all of it at length."""
