"""What watches over flights, and commands vehicles by itself: endings, leases, the border."""
