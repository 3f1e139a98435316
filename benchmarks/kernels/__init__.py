"""C kernels of moment filters, written from the equations in index notation: unique nonzero terms, nothing else."""
