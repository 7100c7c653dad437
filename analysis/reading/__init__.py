"""Read the numbers of an impact from the motion alone, without a model of the plate: flights, edges, bounces, pulse."""
