"""The searches for points: Algorithm 1 of the paper, and exchange over a pool with ascents."""
