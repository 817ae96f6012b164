"""Files that are read are trusted in nothing: what they say must agree, or is refused."""
