"""What a run keeps: rows, frames, energy books, states between the steps."""
