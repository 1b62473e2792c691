SET statement_timeout = 0;
SET lock_timeout = 0;
SET idle_in_transaction_session_timeout = 0;
SET client_encoding = 'UTF8';
SET standard_conforming_strings = on;
SET check_function_bodies = false;
SET xmloption = content;
SET client_min_messages = warning;
SET row_security = off;
SET default_tablespace = '';
CREATE TABLE public.newest (
    device text NOT NULL,
    id text NOT NULL,
    quantity text NOT NULL,
    representation text NOT NULL,
    value json NOT NULL,
    "time" timestamp with time zone NOT NULL,
    received timestamp with time zone NOT NULL
)
WITH (fillfactor='50');
CREATE TABLE public.readings (
    device text NOT NULL,
    seq bigint NOT NULL,
    id text NOT NULL,
    quantity text NOT NULL,
    representation text NOT NULL,
    value json NOT NULL,
    number double precision,
    "time" timestamp with time zone NOT NULL,
    received timestamp with time zone NOT NULL
)
PARTITION BY RANGE ("time");
CREATE TABLE public.readings_2026_09_20 (
    device text NOT NULL,
    seq bigint NOT NULL,
    id text NOT NULL,
    quantity text NOT NULL,
    representation text NOT NULL,
    value json NOT NULL,
    number double precision,
    "time" timestamp with time zone NOT NULL,
    received timestamp with time zone NOT NULL
);
CREATE TABLE public.readings_2026_09_21 (
    device text NOT NULL,
    seq bigint NOT NULL,
    id text NOT NULL,
    quantity text NOT NULL,
    representation text NOT NULL,
    value json NOT NULL,
    number double precision,
    "time" timestamp with time zone NOT NULL,
    received timestamp with time zone NOT NULL
);
CREATE TABLE public.readings_other (
    device text NOT NULL,
    seq bigint NOT NULL,
    id text NOT NULL,
    quantity text NOT NULL,
    representation text NOT NULL,
    value json NOT NULL,
    number double precision,
    "time" timestamp with time zone NOT NULL,
    received timestamp with time zone NOT NULL
);
CREATE TABLE public.workers (
    name text NOT NULL,
    stored bigint DEFAULT 0 NOT NULL,
    repeats bigint DEFAULT 0 NOT NULL
)
WITH (fillfactor='50');
ALTER TABLE ONLY public.readings ATTACH PARTITION public.readings_2026_09_20 FOR VALUES FROM ('2026-09-20 00:00:00+00') TO ('2026-09-21 00:00:00+00');
ALTER TABLE ONLY public.readings ATTACH PARTITION public.readings_2026_09_21 FOR VALUES FROM ('2026-09-21 00:00:00+00') TO ('2026-09-22 00:00:00+00');
ALTER TABLE ONLY public.readings ATTACH PARTITION public.readings_other DEFAULT;
INSERT INTO public.newest VALUES ('uav-1', '1', 'alt', 'm', '19', '2026-09-21 13:56:59+00', '2026-11-26 05:20:25.801811+00');
INSERT INTO public.newest VALUES ('uav-1', '1', 'note', 'm', '"\u00fc \" ''"', '2026-09-21 13:56:41+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.newest VALUES ('uav-1', '1', 'position', 'm', '[-35.3, 149.1, 20.0]', '2026-09-21 13:56:40+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.newest VALUES ('uav-2', '1', 'alt', 'm', '5', '2026-09-21 13:56:45+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_20 VALUES ('uav-1', 102, '1', 'alt', 'm', '1.5', 1.5, '2026-09-20 23:59:59.5+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 103, '1', 'alt', 'm', '1.5', 1.5, '2026-09-21 00:00:00+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 0, '1', 'alt', 'm', '0', 0, '2026-09-21 13:56:40+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 100, '1', 'position', 'm', '[-35.3, 149.1, 20.0]', NULL, '2026-09-21 13:56:40+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 1, '1', 'alt', 'm', '1', 1, '2026-09-21 13:56:41+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 101, '1', 'note', 'm', '"\u00fc \" ''"', NULL, '2026-09-21 13:56:41+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 2, '1', 'alt', 'm', '2', 2, '2026-09-21 13:56:42+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 3, '1', 'alt', 'm', '3', 3, '2026-09-21 13:56:43+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 4, '1', 'alt', 'm', '4', 4, '2026-09-21 13:56:44+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 5, '1', 'alt', 'm', '5', 5, '2026-09-21 13:56:45+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 6, '1', 'alt', 'm', '6', 6, '2026-09-21 13:56:46+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 7, '1', 'alt', 'm', '7', 7, '2026-09-21 13:56:47+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 8, '1', 'alt', 'm', '8', 8, '2026-09-21 13:56:48+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 9, '1', 'alt', 'm', '9', 9, '2026-09-21 13:56:49+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 10, '1', 'alt', 'm', '10', 10, '2026-09-21 13:56:50+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 11, '1', 'alt', 'm', '11', 11, '2026-09-21 13:56:51+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 12, '1', 'alt', 'm', '12', 12, '2026-09-21 13:56:52+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 13, '1', 'alt', 'm', '13', 13, '2026-09-21 13:56:53+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 14, '1', 'alt', 'm', '14', 14, '2026-09-21 13:56:54+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 15, '1', 'alt', 'm', '15', 15, '2026-09-21 13:56:55+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 16, '1', 'alt', 'm', '16', 16, '2026-09-21 13:56:56+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 17, '1', 'alt', 'm', '17', 17, '2026-09-21 13:56:57+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 18, '1', 'alt', 'm', '18', 18, '2026-09-21 13:56:58+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-1', 19, '1', 'alt', 'm', '19', 19, '2026-09-21 13:56:59+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.readings_2026_09_21 VALUES ('uav-2', 5, '1', 'alt', 'm', '5', 5, '2026-09-21 13:56:45+00', '2026-11-26 05:20:25.773065+00');
INSERT INTO public.workers VALUES ('worker-1', 25, 3);
ALTER TABLE ONLY public.newest
    ADD CONSTRAINT newest_pkey PRIMARY KEY (device, quantity);
ALTER TABLE ONLY public.readings
    ADD CONSTRAINT readings_device_time_seq_key UNIQUE (device, "time", seq);
ALTER TABLE ONLY public.readings_2026_09_20
    ADD CONSTRAINT readings_2026_09_20_device_time_seq_key UNIQUE (device, "time", seq);
ALTER TABLE ONLY public.readings_2026_09_21
    ADD CONSTRAINT readings_2026_09_21_device_time_seq_key UNIQUE (device, "time", seq);
ALTER TABLE ONLY public.readings_other
    ADD CONSTRAINT readings_other_device_time_seq_key UNIQUE (device, "time", seq);
ALTER TABLE ONLY public.workers
    ADD CONSTRAINT workers_pkey PRIMARY KEY (name);
ALTER INDEX public.readings_device_time_seq_key ATTACH PARTITION public.readings_2026_09_20_device_time_seq_key;
ALTER INDEX public.readings_device_time_seq_key ATTACH PARTITION public.readings_2026_09_21_device_time_seq_key;
ALTER INDEX public.readings_device_time_seq_key ATTACH PARTITION public.readings_other_device_time_seq_key;
