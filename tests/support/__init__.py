"""What several tests share: random states, derivatives, variants of robots, a reference law."""
