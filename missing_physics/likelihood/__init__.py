"""How probable recorded torques are under a model: spectra, weights and Gaussian evidence by joint."""
