"""Speed against accuracy: contenders on scenes, measured against references, and where methods fail."""
