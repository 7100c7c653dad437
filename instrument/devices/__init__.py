"""Digitizers: the contract, one driver each, how they are named, opened and found."""
