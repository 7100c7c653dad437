"""The verdict: which effects are accepted, and which others would explain the shots as well."""
