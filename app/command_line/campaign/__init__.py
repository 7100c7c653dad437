"""Thousands of shots over processes or machines: handed out, journalled, taken up where a call ended."""
