"""From recordings to a regression problem, divided into data that are fitted and data that are held out."""
