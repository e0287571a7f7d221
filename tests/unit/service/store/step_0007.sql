BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0007');
CREATE TABLE campaigns (
	number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	id VARCHAR NOT NULL, 
	spec TEXT NOT NULL, 
	state VARCHAR NOT NULL, 
	reason VARCHAR, 
	created_at FLOAT NOT NULL, 
	started_at FLOAT, 
	finished_at FLOAT, project VARCHAR DEFAULT 'default' NOT NULL, label VARCHAR DEFAULT '' NOT NULL, idempotency_key VARCHAR, revision INTEGER DEFAULT '1' NOT NULL, checksum BIGINT, events INTEGER DEFAULT '0' NOT NULL, 
	UNIQUE (id)
);
INSERT INTO "campaigns" VALUES(1,'c7ad27810a335149d','{"label":"of today","families":["low"],"methods":["random"],"seeds":[0,1],"budget":{"episodes":300,"evaluation_episodes":0,"cpu_s":null,"least_episodes":1},"ego":{"profile":"default","car_following":"Krauss","reaction_time_s":0.5,"sensor":{"range_m":80.0,"field_of_view_rad":6.283185307179586,"occlusion":true,"memory_s":3.0}},"odd":{"scenery":{"lanes":null,"speed_limit_mps":null,"signal_types":null,"crossing_types":null},"environment":{"friction":null,"visibility_m":null},"dynamic":{"actor_kinds":null,"ego_speed_mps":null,"vehicle_speed_mps":null,"vehicle_accel_mps2":null,"vehicle_lateral_speed_mps":null,"vehicle_lateral_accel_mps2":null,"pedestrian_speed_mps":null,"pedestrian_accel_mps2":null}},"requirements":[],"learner":{"agent":{"hidden_sizes":[64,64],"batch_size":256,"discount":0.99,"actor_learning_rate":0.001,"critic_learning_rate":0.001,"target_rate":0.01,"warmup_steps":1000,"decision_steps":5,"updates_per_step":1.0,"device":"auto"},"sac":{"temperature_learning_rate":0.001,"initial_temperature":0.02,"target_entropy_per_action":-1.0},"ddpg":{"exploration_deviation":0.2},"replay":{"capacity":100000,"td_weight":1.0,"return_weight":0.5,"robustness_weight":0.5,"priority_floor":0.05,"correction":0.6},"lagrangian":{"initial":0.0,"learning_rate":0.0005,"cost_limit":0.2,"maximum":0.15},"reward":{"valid_collision":20.0,"unpreventable":0.5,"unavoidable":0.25,"degenerate_collision":4.0,"ttc_weight":0.2,"ttc_scale_s":1.0,"rss_weight":0.1,"softmin_sharpness":20.0,"zero_terminal_potential":true},"warm_start":{"episodes":150,"failures":15},"scenes":{"initial_scenes":16,"window":150,"refit_every":10,"candidates":256,"exploration":0.1,"running_maximum_rate":0.1},"checkpoint_every":20}}','running',NULL,1.79563681948497843744e+09,1.79563681971449351309e+09,NULL,'default','of today',NULL,8,950250416,7);
CREATE TABLE changes (
	number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	campaign_number INTEGER NOT NULL, 
	run_id VARCHAR, 
	state VARCHAR NOT NULL, 
	reason VARCHAR, 
	at FLOAT NOT NULL, 
	checksum BIGINT, sequence INTEGER DEFAULT '0' NOT NULL, 
	FOREIGN KEY(campaign_number) REFERENCES campaigns (number)
);
INSERT INTO "changes" VALUES(1,1,'low-random-0','running',NULL,1.79563681962764763828e+09,2811650879,1);
INSERT INTO "changes" VALUES(2,1,NULL,'running',NULL,1.79563681971450281142e+09,1939457138,2);
INSERT INTO "changes" VALUES(3,1,'low-random-1','running',NULL,1.79563681975855684276e+09,2929822196,3);
INSERT INTO "changes" VALUES(4,1,'low-random-0','succeeded',NULL,1.79563682061091685294e+09,4142261892,7);
CREATE TABLE episodes (
	number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	campaign_number INTEGER NOT NULL, 
	run_number INTEGER NOT NULL, 
	phase VARCHAR NOT NULL, 
	"index" INTEGER NOT NULL, 
	outcome VARCHAR NOT NULL, 
	record TEXT NOT NULL, 
	series VARCHAR, 
	wall_s FLOAT NOT NULL, series_sha256 VARCHAR, checksum BIGINT, grade VARCHAR, signature VARCHAR, broke VARCHAR, funnel TEXT, sequence INTEGER DEFAULT '0' NOT NULL, 
	FOREIGN KEY(campaign_number) REFERENCES campaigns (number), 
	FOREIGN KEY(run_number) REFERENCES runs (number)
);
INSERT INTO "episodes" VALUES(1,1,1,'train',0,'safe','{"index":0,"phase":"train","seed":0,"scene":{"lead_gap_m":12.5},"outcome":"safe","reason":"","steps":100,"risk_return":1.0,"shaped_return":0.5,"mean_cost":0.1,"min_ttc_s":"Infinity","min_robustness":-1.0,"objective":null,"dual_variable":0.3,"temperature":0.2,"environment_steps":100,"script":null,"collision":null}',NULL,0.5,NULL,530293107,NULL,NULL,NULL,'{"contacts":0,"valid":0,"distinct":0,"preventable":0}',4);
INSERT INTO "episodes" VALUES(2,1,1,'train',1,'failure','{"index":1,"phase":"train","seed":1,"scene":{"lead_gap_m":12.5},"outcome":"failure","reason":"","steps":100,"risk_return":1.0,"shaped_return":0.5,"mean_cost":0.1,"min_ttc_s":0.0,"min_robustness":-1.0,"objective":null,"dual_variable":0.3,"temperature":0.2,"environment_steps":200,"script":null,"collision":{"time_s":3.2,"other_id":"lead","other_kind":"vehicle","other_role":"adversary","contact_x_m":2.3,"contact_y_m":0.1,"ego_zone":"front","other_zone":"rear","ego_speed_mps":9.0,"other_speed_mps":2.0,"relative_speed_mps":7.0,"lateral_offset_m":0.1,"early_min_ttc_s":"Infinity","min_rss_margin_m":-3.0,"visible_for_s":3.0,"ego_peak_braking_mps2":4.5,"early_min_robustness":-1.0,"simulator_agrees":true,"verdicts":{"inside_limits":true,"ego_moving":true},"judgement":{"definitions":1,"conflict_type":"cut_in","conflict_s":2.5,"noticed_s":null,"conflict_x_m":301.0,"conflict_y_m":-2.5,"position":"ahead","hidden":false,"ego_manoeuvre":"straight","ego_response":"late_braking","ground":"lane","broke":["red_light","speeding"],"unresponsive":false,"grade":"careful","drivers":{"careful":{"avoids":true,"impact_speed_mps":0.0},"bound":{"avoids":true,"impact_speed_mps":0.0}},"signature":"cut-in, straight"}}}','000001.npz',0.5,'0000000000000000000000000000000000000000000000000000000000000000',801943380,'careful','cut-in, straight',',red_light,speeding,','{"contacts":1,"valid":1,"distinct":1,"preventable":0}',5);
INSERT INTO "episodes" VALUES(3,1,1,'train',2,'degenerate','{"index":2,"phase":"train","seed":2,"scene":{"lead_gap_m":12.5},"outcome":"degenerate","reason":"","steps":100,"risk_return":1.0,"shaped_return":0.5,"mean_cost":0.1,"min_ttc_s":0.0,"min_robustness":-1.0,"objective":null,"dual_variable":0.3,"temperature":0.2,"environment_steps":300,"script":null,"collision":{"time_s":3.2,"other_id":"lead","other_kind":"vehicle","other_role":"adversary","contact_x_m":2.3,"contact_y_m":0.1,"ego_zone":"front","other_zone":"rear","ego_speed_mps":9.0,"other_speed_mps":2.0,"relative_speed_mps":7.0,"lateral_offset_m":0.1,"early_min_ttc_s":"Infinity","min_rss_margin_m":-3.0,"visible_for_s":3.0,"ego_peak_braking_mps2":4.5,"early_min_robustness":-1.0,"simulator_agrees":true,"verdicts":{"inside_limits":true,"ego_moving":true},"judgement":{"definitions":1,"conflict_type":"cut_in","conflict_s":2.5,"noticed_s":null,"conflict_x_m":301.0,"conflict_y_m":-2.5,"position":"ahead","hidden":false,"ego_manoeuvre":"straight","ego_response":"late_braking","ground":"lane","broke":["red_light","speeding"],"unresponsive":false,"grade":"careful","drivers":{"careful":{"avoids":true,"impact_speed_mps":0.0},"bound":{"avoids":true,"impact_speed_mps":0.0}},"signature":"cut-in, straight"}}}','000002.npz',0.5,'0000000000000000000000000000000000000000000000000000000000000000',4039293010,NULL,'cut-in, straight',',red_light,speeding,','{"contacts":2,"valid":1,"distinct":1,"preventable":0}',6);
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
	versions TEXT NOT NULL, attempts INTEGER DEFAULT '0' NOT NULL, checksum BIGINT, distinct_failures INTEGER DEFAULT '0' NOT NULL, preventable INTEGER DEFAULT '0' NOT NULL, distinct_preventable INTEGER DEFAULT '0' NOT NULL, repetitions TEXT, 
	FOREIGN KEY(campaign_number) REFERENCES campaigns (number)
);
INSERT INTO "runs" VALUES(1,1,'low-random-0','low','random',0,'61981ebdec04b6202af1eee9a8bcdc16eed0f0f0f859155693bc596c1e55447c','succeeded',NULL,1.79563681962775230404e+09,1.7956368206109807491e+09,300,3,0,2,1,1.5,'{"episodes":3,"rejected":0,"raw_collisions":2,"failures":1,"invalid":0,"environment_steps":300,"ecr":0.0,"ecr_low":0.0,"ecr_high":0.5,"window_ecr":0.0,"pcr":0.0,"pcr_low":0.0,"pcr_high":1.0,"window_pcr":0.0,"efficiency":0.0,"cost_rate":0.0,"dispersion":null,"dual_variable":0.0,"temperature":0.0,"distinct_failures":1,"steps_per_distinct_failure":null,"preventable":0,"avoidable":0,"distinct_preventable":0,"covered":0,"artefacts":0,"unresponsive":0,"signatures":{},"conflicts_by_second":[],"contacts_by_second":[]}',NULL,'abc','{"libsumo":"1.28.0"}',1,794067285,1,0,0,'{"1":{"times":3,"same":3}}');
INSERT INTO "runs" VALUES(2,1,'low-random-1','low','random',1,'06059883960d74e3900349af1d217661f548629b9d58906e6c0edf69d4b6c64a','running',NULL,1.79563681975863218302e+09,NULL,300,0,0,0,0,0.0,NULL,NULL,NULL,'{}',1,3784015580,0,0,0,NULL);
CREATE TABLE server (
	number INTEGER NOT NULL, 
	cursor_secret VARCHAR NOT NULL, 
	keys_made_at FLOAT, 
	checksum BIGINT, 
	PRIMARY KEY (number)
);
INSERT INTO "server" VALUES(1,'519ee1d2da6a8ee4a8591b6771c24f73f36fd5cf723bf866aa83024f6faef91b',NULL,2547787843);
CREATE TABLE triages (
	number INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	campaign_number INTEGER NOT NULL, 
	episode_number INTEGER NOT NULL, 
	state VARCHAR NOT NULL, 
	comment TEXT NOT NULL, 
	changed_at FLOAT NOT NULL, 
	checksum BIGINT, 
	FOREIGN KEY(campaign_number) REFERENCES campaigns (number), 
	FOREIGN KEY(episode_number) REFERENCES episodes (number)
);
INSERT INTO "triages" VALUES(1,1,2,'confirmed','seen',1.79563682070768928524e+09,3592383309);
CREATE TABLE usage (
	project VARCHAR NOT NULL, 
	hour INTEGER NOT NULL, 
	busy_s FLOAT NOT NULL, 
	checksum BIGINT, 
	PRIMARY KEY (project, hour)
);
INSERT INTO "usage" VALUES('default',498788,1.5,572349355);
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
CREATE INDEX episodes_runs ON episodes (run_number, number);
CREATE UNIQUE INDEX episodes_ids ON episodes (run_number, phase, "index");
CREATE INDEX episodes_grades ON episodes (campaign_number, grade, number) WHERE grade IS NOT NULL;
CREATE INDEX episodes_signatures ON episodes (campaign_number, signature, number) WHERE signature IS NOT NULL;
CREATE INDEX runs_tallies ON runs (family, method, state, episodes_done, raw_collisions, failures, distinct_failures, preventable, distinct_preventable);
CREATE UNIQUE INDEX episodes_sequence ON episodes (campaign_number, sequence);
CREATE UNIQUE INDEX changes_sequence ON changes (campaign_number, sequence);
CREATE UNIQUE INDEX triages_episodes ON triages (campaign_number, episode_number);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('campaigns',1);
INSERT INTO "sqlite_sequence" VALUES('runs',2);
INSERT INTO "sqlite_sequence" VALUES('changes',4);
INSERT INTO "sqlite_sequence" VALUES('episodes',3);
INSERT INTO "sqlite_sequence" VALUES('triages',1);
COMMIT;
