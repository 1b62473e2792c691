"""What streams tell."""
