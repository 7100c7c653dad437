"""Where a shot begins in a stream of counts: a step of the light switch, or the block that starts to move."""
