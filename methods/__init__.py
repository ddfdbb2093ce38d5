"""What competes: imitation policies, which see a task only as arrays."""
