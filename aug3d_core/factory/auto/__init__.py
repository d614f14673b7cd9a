"""No more than a scene needs: the settings that the preset `auto` leaves open, decided when their stage comes."""
