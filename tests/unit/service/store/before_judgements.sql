BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0002');
CREATE TABLE campaigns (
	number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	id VARCHAR NOT NULL, 
	spec TEXT NOT NULL, 
	state VARCHAR NOT NULL, 
	reason VARCHAR, 
	created_at FLOAT NOT NULL, 
	started_at FLOAT, 
	finished_at FLOAT, project VARCHAR DEFAULT 'default' NOT NULL, label VARCHAR DEFAULT '' NOT NULL, idempotency_key VARCHAR, revision INTEGER DEFAULT '1' NOT NULL, checksum BIGINT, 
	UNIQUE (id)
);
INSERT INTO "campaigns" VALUES(1,'c4da8dfdbad546045','{"label":"","families":["low"],"methods":["random"],"seeds":[0,1],"budget":{"episodes":300,"evaluation_episodes":0},"ego":{"profile":"default","car_following":"Krauss","reaction_time_s":0.5,"sensor":{"range_m":80.0,"field_of_view_rad":6.283185307179586,"occlusion":true,"memory_s":0.5}},"odd":{"scenery":{"lanes":null,"speed_limit_mps":null,"signal_types":null,"crossing_types":null},"environment":{"friction":null,"visibility_m":null},"dynamic":{"actor_kinds":null,"ego_speed_mps":null,"vehicle_speed_mps":null,"vehicle_accel_mps2":null,"pedestrian_speed_mps":null,"pedestrian_accel_mps2":null}},"requirements":[],"learner":{"agent":{"hidden_sizes":[64,64],"batch_size":256,"discount":0.99,"actor_learning_rate":0.0003,"critic_learning_rate":0.001,"target_rate":0.005,"warmup_steps":1000,"updates_per_step":1,"device":"auto"},"sac":{"temperature_learning_rate":0.0003,"initial_temperature":0.02,"target_entropy_per_action":-1.0},"ddpg":{"exploration_deviation":0.2},"replay":{"capacity":100000,"td_weight":1.0,"return_weight":0.5,"robustness_weight":0.5,"priority_floor":0.05,"correction":0.6},"lagrangian":{"initial":0.0,"learning_rate":0.0005,"cost_limit":0.2,"maximum":0.5},"reward":{"valid_collision":20.0,"degenerate_collision":4.0,"ttc_weight":0.2,"ttc_scale_s":1.0,"rss_weight":0.1,"softmin_sharpness":5.0,"zero_terminal_potential":true},"scenes":{"initial_scenes":16,"window":150,"refit_every":10,"candidates":256,"exploration":0.1,"running_maximum_rate":0.1},"checkpoint_every":20}}','running',NULL,1.79528603290125918388e+09,1.79528603292207479483e+09,NULL,'default','',NULL,7,2787601853);
CREATE TABLE changes (
	number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	campaign_number INTEGER NOT NULL, 
	run_id VARCHAR, 
	state VARCHAR NOT NULL, 
	reason VARCHAR, 
	at FLOAT NOT NULL, 
	checksum BIGINT, 
	FOREIGN KEY(campaign_number) REFERENCES campaigns (number)
);
INSERT INTO "changes" VALUES(1,1,'low-random-0','running',NULL,1.79528603291160345073e+09,760100103);
INSERT INTO "changes" VALUES(2,1,NULL,'running',NULL,1.79528603292208266254e+09,1417655934);
CREATE TABLE episodes (
	number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	campaign_number INTEGER NOT NULL, 
	run_number INTEGER NOT NULL, 
	phase VARCHAR NOT NULL, 
	"index" INTEGER NOT NULL, 
	outcome VARCHAR NOT NULL, 
	record TEXT NOT NULL, 
	series VARCHAR, 
	wall_s FLOAT NOT NULL, series_sha256 VARCHAR, checksum BIGINT, 
	FOREIGN KEY(campaign_number) REFERENCES campaigns (number), 
	FOREIGN KEY(run_number) REFERENCES runs (number)
);
INSERT INTO "episodes" VALUES(1,1,1,'train',0,'safe','{"index":0,"phase":"train","seed":7,"scene":{"lead_gap_m":12.5},"outcome":"safe","reason":"","steps":100,"risk_return":1.0,"shaped_return":2.0,"mean_cost":0.1,"min_ttc_s":"Infinity","min_robustness":0.2,"objective":null,"dual_variable":0.3,"temperature":0.2,"environment_steps":100,"collision":null}',NULL,0.5,NULL,2797610591);
INSERT INTO "episodes" VALUES(2,1,1,'train',1,'failure','{"index":1,"phase":"train","seed":7,"scene":{"lead_gap_m":12.5},"outcome":"failure","reason":"","steps":100,"risk_return":1.0,"shaped_return":2.0,"mean_cost":0.1,"min_ttc_s":"Infinity","min_robustness":0.2,"objective":null,"dual_variable":0.3,"temperature":0.2,"environment_steps":200,"collision":{"time_s":3.2,"other_id":"lead","other_kind":"vehicle","other_role":"adversary","contact_x_m":2.3,"contact_y_m":0.1,"ego_zone":"front","other_zone":"rear","ego_speed_mps":9.0,"other_speed_mps":2.0,"relative_speed_mps":7.0,"lateral_offset_m":0.1,"min_ttc_s":"NaN","min_rss_margin_m":-3.0,"visible_for_s":3.0,"ego_peak_braking_mps2":4.5,"min_robustness":"-Infinity","simulator_agrees":true,"verdicts":{"feasible":true}}}','a.npz',0.5,NULL,2617543999);
INSERT INTO "episodes" VALUES(3,1,1,'train',2,'degenerate','{"index":2,"phase":"train","seed":7,"scene":{"lead_gap_m":12.5},"outcome":"degenerate","reason":"","steps":100,"risk_return":1.0,"shaped_return":2.0,"mean_cost":0.1,"min_ttc_s":"Infinity","min_robustness":0.2,"objective":null,"dual_variable":0.3,"temperature":0.2,"environment_steps":300,"collision":{"time_s":3.2,"other_id":"lead","other_kind":"vehicle","other_role":"adversary","contact_x_m":2.3,"contact_y_m":0.1,"ego_zone":"front","other_zone":"rear","ego_speed_mps":9.0,"other_speed_mps":2.0,"relative_speed_mps":7.0,"lateral_offset_m":0.1,"min_ttc_s":"NaN","min_rss_margin_m":-3.0,"visible_for_s":3.0,"ego_peak_braking_mps2":4.5,"min_robustness":"-Infinity","simulator_agrees":true,"verdicts":{"feasible":true}}}','a.npz',0.5,NULL,240523836);
INSERT INTO "episodes" VALUES(4,1,1,'train',3,'rejected','{"index":3,"phase":"train","seed":7,"scene":{"lead_gap_m":12.5},"outcome":"rejected","reason":"","steps":100,"risk_return":1.0,"shaped_return":2.0,"mean_cost":0.1,"min_ttc_s":"Infinity","min_robustness":0.2,"objective":null,"dual_variable":0.3,"temperature":0.2,"environment_steps":400,"collision":null}',NULL,0.5,NULL,3163060518);
INSERT INTO "episodes" VALUES(5,1,1,'evaluate',0,'failure','{"index":0,"phase":"evaluate","seed":7,"scene":{"lead_gap_m":12.5},"outcome":"failure","reason":"","steps":100,"risk_return":1.0,"shaped_return":2.0,"mean_cost":0.1,"min_ttc_s":"Infinity","min_robustness":0.2,"objective":null,"dual_variable":0.3,"temperature":0.2,"environment_steps":100,"collision":{"time_s":3.2,"other_id":"lead","other_kind":"vehicle","other_role":"adversary","contact_x_m":2.3,"contact_y_m":0.1,"ego_zone":"front","other_zone":"rear","ego_speed_mps":9.0,"other_speed_mps":2.0,"relative_speed_mps":7.0,"lateral_offset_m":0.1,"min_ttc_s":"NaN","min_rss_margin_m":-3.0,"visible_for_s":3.0,"ego_peak_braking_mps2":4.5,"min_robustness":"-Infinity","simulator_agrees":true,"verdicts":{"feasible":true}}}','a.npz',0.5,NULL,3106873954);
CREATE TABLE runs (
	number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	campaign_number INTEGER NOT NULL, 
	id VARCHAR NOT NULL, 
	family VARCHAR NOT NULL, 
	method VARCHAR NOT NULL, 
	seed INTEGER NOT NULL, 
	spec_digest VARCHAR NOT NULL, 
	state VARCHAR NOT NULL, 
	reason VARCHAR, 
	started_at FLOAT, 
	finished_at FLOAT, 
	episodes_total INTEGER NOT NULL, 
	episodes_done INTEGER NOT NULL, 
	rejected INTEGER NOT NULL, 
	raw_collisions INTEGER NOT NULL, 
	failures INTEGER NOT NULL, 
	busy_s FLOAT NOT NULL, 
	metrics TEXT, 
	evaluation TEXT, 
	digest VARCHAR, 
	versions TEXT NOT NULL, attempts INTEGER DEFAULT '0' NOT NULL, checksum BIGINT, 
	FOREIGN KEY(campaign_number) REFERENCES campaigns (number)
);
INSERT INTO "runs" VALUES(1,1,'low-random-0','low','random',0,'fbdcadab28304bd6a0deb357c5ac0a2e6b2970026de99a09f6b2f4e05b26b625','running',NULL,1.79528603291173172e+09,NULL,300,5,1,3,2,2.5,'{"episodes":4,"rejected":1,"raw_collisions":2,"failures":1,"environment_steps":400,"ecr":0.25,"ecr_low":0.05,"ecr_high":0.7,"window_ecr":0.25,"efficiency":0.5,"cost_rate":0.1,"dispersion":null,"dual_variable":0.3,"temperature":0.2,"distinct_failures":1,"steps_per_distinct_failure":400.0}','{"episodes":4,"rejected":1,"raw_collisions":2,"failures":1,"environment_steps":400,"ecr":0.25,"ecr_low":0.05,"ecr_high":0.7,"window_ecr":0.25,"efficiency":0.5,"cost_rate":0.1,"dispersion":null,"dual_variable":0.3,"temperature":0.2,"distinct_failures":1,"steps_per_distinct_failure":400.0}',NULL,'{}',1,1492808126);
INSERT INTO "runs" VALUES(2,1,'low-random-1','low','random',1,'785427fccfe7f44382611af67b9724eb2cc55ff0bd85d650ab9fd72445c3c42d','queued',NULL,NULL,NULL,300,0,0,0,0,0.0,NULL,NULL,NULL,'{}',0,4234463072);
CREATE TABLE usage (
	project VARCHAR NOT NULL, 
	hour INTEGER NOT NULL, 
	busy_s FLOAT NOT NULL, 
	checksum BIGINT, 
	PRIMARY KEY (project, hour)
);
INSERT INTO "usage" VALUES('default',498690,2.5,3055975682);
CREATE INDEX runs_queue ON runs (state, number);
CREATE INDEX episodes_pages ON episodes (campaign_number, number);
CREATE INDEX episodes_outcomes ON episodes (campaign_number, outcome, number);
CREATE UNIQUE INDEX campaigns_idempotency ON campaigns (project, idempotency_key);
CREATE INDEX campaigns_state ON campaigns (state, number);
CREATE INDEX campaigns_label ON campaigns (label, number);
CREATE INDEX campaigns_project ON campaigns (project, number);
CREATE UNIQUE INDEX runs_ids ON runs (campaign_number, id);
CREATE INDEX runs_families ON runs (family, campaign_number);
CREATE INDEX runs_methods ON runs (method, campaign_number);
CREATE INDEX runs_tallies ON runs (family, method, state, episodes_done, failures);
CREATE INDEX episodes_runs ON episodes (run_number, number);
CREATE UNIQUE INDEX episodes_ids ON episodes (run_number, phase, "index");
CREATE INDEX changes_pages ON changes (campaign_number, number);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('campaigns',1);
INSERT INTO "sqlite_sequence" VALUES('runs',2);
INSERT INTO "sqlite_sequence" VALUES('changes',2);
INSERT INTO "sqlite_sequence" VALUES('episodes',5);
COMMIT;
