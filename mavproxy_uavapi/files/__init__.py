"""What the owner keeps on the disk: tokens, an envelope, logs, the tiles of a map."""
