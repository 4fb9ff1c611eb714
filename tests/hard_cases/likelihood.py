"""Hard cases of the likelihood and its posterior: tables that say too little, or too much."""
