"""Reading an impact from the motion alone: flights, edges, bounces, pulse; no model of the plate."""
