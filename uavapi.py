from mavproxy_uavapi.module import init as init
