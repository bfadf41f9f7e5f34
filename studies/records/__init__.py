"""Three figures that engines on a height field can be compared by: terrain tax, touchdown, and the size of cells."""
