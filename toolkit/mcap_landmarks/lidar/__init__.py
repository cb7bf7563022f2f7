"""What a planar LiDAR sees: beams, segments, the shapes of objects and where their centres are."""
