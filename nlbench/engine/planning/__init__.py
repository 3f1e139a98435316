"""What a run would cost before it is made: time, memory, disk, and the runs that a precision needs."""
