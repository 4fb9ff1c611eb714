"""What accuracy costs in time: settings of each method, their error and their price."""
