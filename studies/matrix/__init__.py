"""The stability matrix: where colliders of moving ground fail, and which of them do."""
