"""Parameter studies: many cases of one question, stored, resumed, and computed by any executor."""
