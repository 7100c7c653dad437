"""The motion of the block from the counts of both beats: phase, displacement, velocity and force with their noise."""
