"""The compiled core, and the choice of its kernels for this machine."""
